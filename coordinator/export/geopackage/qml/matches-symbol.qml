    <symbol name="{{number}}" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
      <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
        <Option type="Map">
          <Option name="name" type="QString" value="circle"/>
          <Option name="color" type="QString" value="{{fill}},255"/>
          <Option name="outline_color" type="QString" value="255,255,255,255"/>
          <Option name="outline_style" type="QString" value="solid"/>
          <Option name="outline_width" type="QString" value="0.3"/>
          <Option name="size" type="QString" value="5.4"/>
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
                <Option name="expression" type="QString" value="if(@map_scale &gt; {{near_scale}}, 2.4, 5.4)"/>
                <Option name="type" type="int" value="3"/>
              </Option>
            </Option>
            <Option name="type" type="QString" value="collection"/>
          </Option>
        </data_defined_properties>
      </layer>
      <layer class="FontMarker" enabled="1" locked="0" pass="0">
        <Option type="Map">
          <Option name="font" type="QString" value="Arial"/>
          <Option name="font_style" type="QString" value="Bold"/>
          <Option name="chr" type="QString" value="1"/>
          <Option name="color" type="QString" value="{{ink}},255"/>
          <Option name="outline_color" type="QString" value="{{ink}},0"/>
          <Option name="outline_width" type="QString" value="0"/>
          <Option name="size" type="QString" value="3.1"/>
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
              <Option name="char" type="Map">
                <Option name="active" type="bool" value="true"/>
                <Option name="expression" type="QString" value="to_string(&quot;rank&quot;)"/>
                <Option name="type" type="int" value="3"/>
              </Option>
              <Option name="enabled" type="Map">
                <Option name="active" type="bool" value="true"/>
                <Option name="expression" type="QString" value="coalesce(@map_scale, 0) &lt;= {{near_scale}}"/>
                <Option name="type" type="int" value="3"/>
              </Option>
              <Option name="size" type="Map">
                <Option name="active" type="bool" value="true"/>
                <Option name="expression" type="QString" value="if(&quot;rank&quot; > 99, 2.2, 3.1)"/>
                <Option name="type" type="int" value="3"/>
              </Option>
            </Option>
            <Option name="type" type="QString" value="collection"/>
          </Option>
        </data_defined_properties>
      </layer>
    </symbol>
