<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>
<qgis version="3.22.0" styleCategories="Symbology|Labeling|Fields|MapTips|Rendering">
  <renderer-v2 type="singleSymbol" symbollevels="0" enableorderby="0" forceraster="0">
    <symbols>
    <symbol name="0" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
      <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
        <Option type="Map">
          <Option name="name" type="QString" value="cross"/>
          <Option name="color" type="QString" value="255,255,255,255"/>
          <Option name="outline_color" type="QString" value="255,255,255,255"/>
          <Option name="outline_style" type="QString" value="solid"/>
          <Option name="outline_width" type="QString" value="1.1"/>
          <Option name="size" type="QString" value="11.4"/>
          <Option name="cap_style" type="QString" value="round"/>
          <Option name="outline_width_unit" type="QString" value="MM"/>
          <Option name="size_unit" type="QString" value="MM"/>
          <Option name="offset" type="QString" value="0,0"/>
          <Option name="horizontal_anchor_point" type="QString" value="1"/>
          <Option name="vertical_anchor_point" type="QString" value="1"/>
        </Option>
        <data_defined_properties>
          <Option type="Map">
            <Option name="name" type="QString" value=""/>
            <Option name="properties" type="Map">
              <Option name="size" type="Map">
                <Option name="active" type="bool" value="true"/>
                <Option name="expression" type="QString" value="if(@map_scale &gt; {{near_scale}}, 5.2, 11.4)"/>
                <Option name="type" type="int" value="3"/>
              </Option>
            </Option>
            <Option name="type" type="QString" value="collection"/>
          </Option>
        </data_defined_properties>
      </layer>
      <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
        <Option type="Map">
          <Option name="name" type="QString" value="cross"/>
          <Option name="color" type="QString" value="8,60,140,255"/>
          <Option name="outline_color" type="QString" value="8,60,140,255"/>
          <Option name="outline_style" type="QString" value="solid"/>
          <Option name="outline_width" type="QString" value="0.5"/>
          <Option name="size" type="QString" value="10.6"/>
          <Option name="cap_style" type="QString" value="round"/>
          <Option name="outline_width_unit" type="QString" value="MM"/>
          <Option name="size_unit" type="QString" value="MM"/>
          <Option name="offset" type="QString" value="0,0"/>
          <Option name="horizontal_anchor_point" type="QString" value="1"/>
          <Option name="vertical_anchor_point" type="QString" value="1"/>
        </Option>
        <data_defined_properties>
          <Option type="Map">
            <Option name="name" type="QString" value=""/>
            <Option name="properties" type="Map">
              <Option name="size" type="Map">
                <Option name="active" type="bool" value="true"/>
                <Option name="expression" type="QString" value="if(@map_scale &gt; {{near_scale}}, 4.6, 10.6)"/>
                <Option name="type" type="int" value="3"/>
              </Option>
              <Option name="outlineColor" type="Map">
                <Option name="active" type="bool" value="true"/>
                <Option name="expression" type="QString" value="if(coalesce(&quot;in_survey&quot;, true), color_rgb(8,60,140), color_rgb(120,120,120))"/>
                <Option name="type" type="int" value="3"/>
              </Option>
            </Option>
            <Option name="type" type="QString" value="collection"/>
          </Option>
        </data_defined_properties>
      </layer>
    </symbol>
    </symbols>
  </renderer-v2>
  <labeling type="none"/>
  <blendMode>0</blendMode>
  <featureBlendMode>0</featureBlendMode>
  <layerOpacity>1</layerOpacity>
  <aliases>{{aliases}}</aliases>
  <previewExpression>"name"</previewExpression>
  <mapTip>{{map_tip}}</mapTip>
</qgis>
